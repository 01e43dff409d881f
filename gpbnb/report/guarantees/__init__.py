"""Guarantees for every measurement and for all time: studies, tables and figures."""
