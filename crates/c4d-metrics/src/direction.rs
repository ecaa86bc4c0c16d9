//! [`Better`]: which values of a metric are better.

/// Which values of a metric are better. Metrics whose level depends on the content alone (motion,
/// texture) do not rank results; their ratio to the source does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Better {
    /// Higher values.
    Higher,
    /// Lower values.
    Lower,
    /// Values near 1; deviations above and below count by the same factor.
    NearOne,
    /// Values near 0.
    NearZero,
    /// Neither: the metric is descriptive.
    Neither,
}

impl Better {
    /// Badness of `value`: of two values, the one with the smaller badness is better. `None` for
    /// descriptive metrics.
    pub fn badness(self, value: f64) -> Option<f64> {
        match self {
            Self::Higher => Some(-value),
            Self::Lower => Some(value),
            // a ratio that is not positive is infinitely bad
            Self::NearOne => Some(if value > 0.0 { value.ln().abs() } else { f64::INFINITY }),
            Self::NearZero => Some(value.abs()),
            Self::Neither => None,
        }
    }

    /// Symbol for tables: `↑`, `↓`, `→1`, `→0`, or nothing.
    pub fn arrow(self) -> &'static str {
        match self {
            Self::Higher => "↑",
            Self::Lower => "↓",
            Self::NearOne => "→1",
            Self::NearZero => "→0",
            Self::Neither => "",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn badness_orders_values() {
        let worse = |better: Better, a: f64, b: f64| better.badness(a) > better.badness(b);
        assert!(worse(Better::Higher, 1.0, 2.0) && worse(Better::Lower, 2.0, 1.0), "plain");
        assert!(worse(Better::NearOne, 0.5, 1.1) && worse(Better::NearOne, 2.0, 0.9), "ratio");
        assert_eq!(Better::NearOne.badness(0.5), Better::NearOne.badness(2.0), "same factor");
        assert!(worse(Better::NearZero, -2.0, 1.0), "either side");
        assert_eq!(Better::Neither.badness(3.0), None, "describes");
    }
}
