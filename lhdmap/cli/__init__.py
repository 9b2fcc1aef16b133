"""The command line: one module a command, loaded when it is called; nothing else in lhdmap prints."""
