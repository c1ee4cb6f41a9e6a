"""The page of many sites: which structures have changed, which monitors are stale or unwell."""

from monitor.service.servers.fleet.app import FleetSource, make_fleet_app, serve_fleet

__all__ = ["FleetSource", "make_fleet_app", "serve_fleet"]
