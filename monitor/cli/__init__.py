"""The command line. Each command imports its modules when it is called."""
