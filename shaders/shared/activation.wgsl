// Needs: nothing
// Stored parameters to used ones. The clamps keep exp() away from overflow; at both ends the result is exact in single precision.

fn sigmoid(logit: f32) -> f32 {
    return 1.0 / (1.0 + exp(-clamp(logit, -87.0, 88.0)));
}

// exp of a log-scale; minus infinity gives 0.
fn scale_of(log_scale: f32) -> f32 {
    return select(exp(log_scale), 0.0, log_scale < -103.0);
}
