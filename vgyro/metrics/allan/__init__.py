"""Allan deviations and covariances, and the noise coefficients that are fitted to them."""
