"""From a scenario to a result: assembly, the runners, the result, validation, and shrinking of fault schedules."""
