"""Binary format of the log: messages, chunks and indexes."""
