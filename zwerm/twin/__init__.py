"""The twin: a scenario with its packets on a real network, compared with the radio's models for the same packets.

`twin_runner` runs it, `packet_comparison` compares real and modelled packets, `twin_report` prints the result. Needs Linux and
root.
"""
