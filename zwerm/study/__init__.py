"""Studies: scenarios run over a grid of settings and many seeds, compared with a paper's numbers.

`study_tables` types the TOML file, and `plan` makes its trials. `trial` runs one, `pool` runs many, and `rows` stores
results. `summary` computes statistics, `study_figure` draws them, and `study_runner` does all of this. `distribute`
spreads a study over machines. A study changes no trace: `zwerm run` reproduces each row.
"""
