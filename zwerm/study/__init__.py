"""Studies: one scenario, or several, run over a grid of settings and many seeds, and set beside a paper's numbers.

`tables` types the TOML file, `plan` makes trials of it, `trial` runs one, `pool` runs many, `rows` keeps what they gave,
`summary` condenses it, `pictures` draws it and `running` does it all. What a study adds to the trace of a run is nothing:
every row can be had again with `zwerm run`.
"""
