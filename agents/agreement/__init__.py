"""Agreement for teaching: averaging, and a leader by leases, under loss, partition and clocks that differ."""

from zwerm.agents.agreement.averaging import Averaging
from zwerm.agents.agreement.leader_lease import LeaderLease

__all__ = ["Averaging", "LeaderLease"]
