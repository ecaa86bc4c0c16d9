//! The payload decoded from the documented layout, within the stated bounds; wrong inputs; and the
//! page in a real browser against our own renders.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "numbers of a layout that the tests themselves made"
)]

mod bounds;
mod browser;
mod decoder;
mod hostile;
mod mutated_payloads;
mod still;
