//! Items as a text table.

use super::definitions::Group;
use super::item::Item;
use std::fmt::Write as _;

/// A table by group, with arrows for the preferred direction, and values with their standard
/// deviation over views.
pub(crate) fn table(items: &[Item]) -> String {
    let mut text = String::new();
    let width = items.iter().map(|item| item.definition.id.len()).max().unwrap_or(0);
    let mut missing: Vec<(&str, Vec<&str>)> = Vec::new();
    for group in Group::ALL {
        let of = || items.iter().filter(|item| item.definition.group == group);
        if of().all(|item| item.value.is_none()) {
            // Listed once at the end.
        } else {
            let _ = writeln!(text, "{}", group.title());
        }
        for item in of() {
            let definition = item.definition;
            let Some(value) = item.value else {
                let reason = item.reason.as_deref().unwrap_or("no value");
                match missing.iter_mut().find(|(known, _)| *known == reason) {
                    Some((_, ids)) => ids.push(definition.id),
                    None => missing.push((reason, vec![definition.id])),
                }
                continue;
            };
            let spread = item.std.map_or(String::new(), |std| format!("±{}", number(std)));
            let _ = writeln!(
                text,
                "  {:width$}  {:2}  {:>10} {spread:<9}  {}",
                definition.id,
                definition.better.arrow(),
                number(value),
                definition.what
            );
        }
    }
    for (reason, ids) in missing {
        let _ = writeln!(text, "not measured ({reason}): {}", ids.join(", "));
    }
    text.pop();
    text
}

/// A value with four significant digits; integers in full.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if value.fract() == 0.0 && value.abs() < 1e15 {
        return format!("{value}");
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few digits")]
    let decimals = (3.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    if decimals > 7 { format!("{value:.2e}") } else { format!("{value:.decimals$}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits() {
        let shown = [38.123_456, 0.000_123_4, 1e-9, 62442.0, 0.0, -0.5].map(number);
        assert_eq!(shown, ["38.12", "0.0001234", "1.00e-9", "62442", "0", "-0.5000"]);
    }
}
