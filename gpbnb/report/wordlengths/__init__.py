"""What determines a wordlength: studies, tables and figures."""
