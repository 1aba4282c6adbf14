"""The unknown of a drive: its prior, the evidence on it, weighted samples, and the answers that these give.

samples = draw_samples(prior_of(drive), drive.operation.M_g, evidence=evidence_of(drive))
samples.percentile(0.95, 0)             # F'_ior [arcsec] at the first torque
samples.probability_within(60.0, 0)     # that F'_ior is at most 60 arcsec there
influences(samples, 0)                  # which fields the spread of F'_ior comes from
"""
