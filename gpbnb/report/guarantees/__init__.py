"""Guarantees for every measurement and for ever: studies, tables and figures."""
