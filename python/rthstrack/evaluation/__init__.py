"""Numbers: settings, inputs, results, estimators, response, indices, P and Q, the monitor."""
