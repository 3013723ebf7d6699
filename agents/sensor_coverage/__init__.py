"""Sensor coverage with bearings and touch only (Ramaithitima, Whitzer, Bhattacharya, Kumar 2015)."""
