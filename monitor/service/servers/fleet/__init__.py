"""The page of many sites: which structures have changed, which monitors are stale or faulty."""

from monitor.service.servers.fleet.app import FleetSource as FleetSource
from monitor.service.servers.fleet.app import serve_fleet as serve_fleet
