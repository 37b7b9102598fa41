"""Estimation on groups: filters whose error lives in the algebra, smoothing, and fits to a run.

ekf = lm.estimation.ErrorStateFilter(lm.estimation.Turning(lm.SO3(), [1e-3] * 3))
belief = ekf.predict(ekf.belief(g, covariance), gyro, h)
belief = ekf.update(belief, lm.estimation.Direction(lm.SO3(), up, [0.01] * 3), measured)
"""

from ..names import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
