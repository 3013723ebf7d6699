"""The coordinator of landmark-based exploration."""

from zwerm.coordinator.landmark_exploration.landmark_coordinator import LandmarkCoordinator as LandmarkCoordinator
