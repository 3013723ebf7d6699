"""Variants of a scenario compared in pairs: same seeds, same faults, differences with intervals."""
