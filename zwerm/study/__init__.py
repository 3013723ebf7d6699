"""Studies: scenarios run over a grid of settings and many seeds, compared with a paper's numbers.

`study_tables` types the TOML file, `plan` makes its trials, `trial` runs one, `pool` runs many, `rows` stores results,
`summary` computes statistics, `study_figure` draws them, `study_runner` does all of this. A study changes no trace: `zwerm run`
reproduces each row.
"""
