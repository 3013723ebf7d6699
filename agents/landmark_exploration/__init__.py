"""Landmark-based exploration by robots that know bearings, contact and their radio (Ramaithitima and Bhattacharya 2018)."""

from zwerm.agents.landmark_exploration.explorer import Explorer as Explorer
from zwerm.agents.landmark_exploration.navigator import Navigator as Navigator
