"""From a start to the closest fit: matching, the residual in casadi, Gauss-Newton."""
