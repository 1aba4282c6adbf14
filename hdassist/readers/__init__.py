"""Files of measuring instruments and workshops: tables, recordings, pitch deviations and lots."""
