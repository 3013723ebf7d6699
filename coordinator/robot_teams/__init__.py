"""Coverage by robot teams with central planning: the coordinator leads one team of all robots."""

from zwerm.coordinator.robot_teams.team_coordinator import TeamCoordinator

__all__ = ["TeamCoordinator"]
