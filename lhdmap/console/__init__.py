"""The operator's console: machines on one page, requests for help, answers, arming; docs/console.md."""
