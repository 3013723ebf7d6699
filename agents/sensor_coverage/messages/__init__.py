"""Messages of sensor coverage: commands of the coordinator, advice, and messages between neighbours."""
