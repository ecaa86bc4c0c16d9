//! Rates as text.

/// A rate with two to three significant digits: `30`, `7.5`, `0.33`.
pub(crate) fn rounded(rate: f64) -> String {
    let decimals = if rate >= 99.95 {
        0
    } else if rate >= 9.995 {
        1
    } else {
        2
    };
    let text = format!("{rate:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_rounded() {
        let rates = [1234.5, 100.0, 30.0, 29.97, 7.5, 9.999, 0.333_3, 0.001];
        let shown = ["1234", "100", "30", "30", "7.5", "10", "0.33", "0"];
        for (rate, shown) in rates.into_iter().zip(shown) {
            assert_eq!(rounded(rate), shown, "{rate}");
        }
    }
}
