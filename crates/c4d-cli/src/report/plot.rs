//! Curves over time, as SVG.

use super::page::escape;
use crate::evaluation::number;
use std::fmt::Write as _;

/// Width of a plot, SVG user units.
const WIDTH: f64 = 440.0;
/// Height of a plot, SVG user units.
const HEIGHT: f64 = 200.0;
/// Margins for labels: left, top, right, bottom.
const MARGINS: [f64; 4] = [62.0, 40.0, 10.0, 24.0];
/// Colours of the curves, in order; distinguishable with red–green colour blindness.
const COLORS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

/// One curve.
pub(crate) struct Curve {
    pub(crate) name: String,
    /// A value for each time; `None` is a gap.
    pub(crate) values: Vec<Option<f64>>,
    /// Drawn dashed, in the colour of the previous curve.
    pub(crate) is_reference: bool,
}

/// Curves over a shared time axis.
pub(crate) struct Plot<'a> {
    pub(crate) title: String,
    /// Unit and meaning.
    pub(crate) what: &'a str,
    pub(crate) times: &'a [f32],
    pub(crate) curves: Vec<Curve>,
}

impl Plot<'_> {
    /// The plot as SVG; empty if there are no values.
    pub(crate) fn svg(&self) -> String {
        let values = || self.curves.iter().flat_map(|curve| curve.values.iter().flatten().copied());
        let (low, high) = values()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let (Some(&first), Some(&last)) = (self.times.first(), self.times.last()) else {
            return String::new();
        };
        if low > high || self.times.len() < 2 {
            return String::new();
        }
        let [left, top, right, bottom] = MARGINS;
        let room = if high > low { 0.05 * (high - low) } else { 0.5 * high.abs().max(1e-6) };
        let (low, high) = (low - room, high + room);
        let span = f64::from(last - first).max(f64::MIN_POSITIVE);
        let x = |t: f32| left + f64::from(t - first) / span * (WIDTH - left - right);
        let y = |v: f64| HEIGHT - bottom - (v - low) / (high - low) * (HEIGHT - top - bottom);
        let mut svg = format!(
            "<svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\"><title>{0}</title><text x=\"{left}\" y=\"16\" class=\"head\">{0}</text><text x=\"{left}\" y=\"30\" class=\"tick\">{1}</text>",
            escape(&self.title),
            escape(self.what)
        );
        for share in [0.0, 0.5, 1.0] {
            let value = low + share * (high - low);
            let at = y(value);
            let _ = write!(
                svg,
                "<line class=\"grid\" x1=\"{left}\" x2=\"{:.1}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/><text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                WIDTH - right,
                left - 5.0,
                at + 4.0,
                number(value)
            );
        }
        for (t, anchor) in [(first, "start"), (last, "end")] {
            let _ = write!(
                svg,
                "<text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">time {}</text>",
                x(t),
                HEIGHT - 7.0,
                number(f64::from(t))
            );
        }
        let mut color = 0;
        for (k, curve) in self.curves.iter().enumerate() {
            if k > 0 && !curve.is_reference {
                color += 1;
            }
            let mut path = String::new();
            let mut pen = 'M';
            for (&t, value) in self.times.iter().zip(&curve.values) {
                match value {
                    Some(value) => {
                        let _ = write!(path, "{pen}{:.1} {:.1}", x(t), y(*value));
                        pen = 'L';
                    }
                    None => pen = 'M',
                }
            }
            let dashes = if curve.is_reference { " stroke-dasharray=\"5 4\"" } else { "" };
            let _ = write!(
                svg,
                "<path d=\"{path}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"{dashes}><title>{}</title></path>",
                COLORS[color % COLORS.len()],
                escape(&curve.name)
            );
        }
        svg.push_str("</svg>");
        svg
    }

    /// A legend for all plots with the same curves.
    pub(crate) fn legend(names: &[String]) -> String {
        let entry = |(k, name): (usize, &String)| {
            format!(
                "<span><b style=\"background:{}\"></b>{}</span>",
                COLORS[k % COLORS.len()],
                escape(name)
            )
        };
        format!(
            "<p class=\"legend\">{} <span>dashed: the source</span></p>",
            names.iter().enumerate().map(entry).collect::<String>()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_have_gaps_at_missing_values() {
        let curve = |values: &[Option<f64>]| Curve {
            name: "a < b".to_owned(),
            values: values.to_vec(),
            is_reference: false,
        };
        let times = [0.0, 0.5, 1.0];
        let plot = |curves| Plot { title: "x".to_owned(), what: "y", times: &times, curves };
        let svg = plot(vec![curve(&[Some(1.0), None, Some(1.0)])]).svg();
        assert!(svg.contains("M62.0") && svg.matches('M').count() == 2, "a gap: {svg}");
        assert!(svg.contains("a &lt; b") && !svg.contains("NaN"), "{svg}");
        assert!(plot(vec![curve(&[None; 3])]).svg().is_empty(), "nothing to draw");
    }
}
