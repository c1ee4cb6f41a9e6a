"""History in a file of SQLite: its checks, its renewal, and what is salvaged from a damaged one."""
