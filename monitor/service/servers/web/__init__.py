"""The outside face: health, metrics and a status page, served by a process of its own from files and the history."""

from monitor.service.servers.web.app import make_app
from monitor.service.servers.web.auth import read_token
from monitor.service.servers.web.process import WebServer, web_process
from monitor.service.servers.web.source import Source

__all__ = ["Source", "WebServer", "make_app", "read_token", "web_process"]
