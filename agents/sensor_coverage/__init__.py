"""Sensor coverage with bearings and touch only (Ramaithitima, Whitzer, Bhattacharya, Kumar 2015)."""

from zwerm.agents.sensor_coverage.central_base import CentralBase
from zwerm.agents.sensor_coverage.central_robot import CentralRobot

__all__ = ["CentralBase", "CentralRobot"]
