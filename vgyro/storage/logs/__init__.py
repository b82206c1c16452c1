"""Logs: any table with columns, of several families, opened by its content and placed in time."""
