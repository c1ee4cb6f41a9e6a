"""The page of many sites: which structures have changed, which monitors are stale or unwell."""

from monitor.service.servers.fleet.app import FleetSource, serve_fleet

__all__ = ["FleetSource", "serve_fleet"]
