"""The outside face: health, metrics and a status page, served by a process of its own from files and the history."""

from monitor.service.servers.web.app import make_app as make_app
from monitor.service.servers.web.auth import read_token as read_token
from monitor.service.servers.web.process import WebServer as WebServer
from monitor.service.servers.web.process import web_process as web_process
from monitor.service.servers.web.source import Source as Source
