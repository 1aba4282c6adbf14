"""Unknown inputs of a drive: their prior, the reference data, weighted samples, and results computed from the samples.

samples = draw_samples(prior_of(drive), drive.operation.M_g, evidence=evidence_of(drive))
samples.percentile(0.95, 0)             # 95th percentile of F'_ior [arcsec] at the first torque
samples.probability_within(60.0, 0)     # probability that F'_ior is at most 60 arcsec at that torque
influences(samples, 0)                  # contributions of fields to the variance of F'_ior
"""
