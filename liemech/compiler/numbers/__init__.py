"""Numbers of the run, and what is done to them: functions, arrays, tables, large matrices."""
