"""Zwerm: robot swarms emulated as what they are, many processes that pass messages, with bit-identical runs."""
