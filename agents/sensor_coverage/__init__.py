"""Sensor coverage with bearings and touch only (Ramaithitima, Whitzer, Bhattacharya, Kumar 2015)."""

from zwerm.agents.sensor_coverage.base import Base
from zwerm.agents.sensor_coverage.robot import Robot

__all__ = ["Base", "Robot"]
