"""Coverage of unknown arenas by robot teams: Latimer et al., Towards Sensor Based Coverage with Robot Teams. 2002."""

from zwerm.agents.robot_teams.robot import TeamRobot

__all__ = ["TeamRobot"]
