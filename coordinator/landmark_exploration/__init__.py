"""The coordinator of landmark-based exploration."""

from zwerm.coordinator.landmark_exploration.coordinator import LandmarkCoordinator as LandmarkCoordinator
