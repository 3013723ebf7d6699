"""Scenarios: from TOML files to typed tables, with every mistake reported in one line each."""
