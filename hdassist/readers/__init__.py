"""Files of instruments and of shops: tables, traces, pitch deviations, lots."""
