//! Tests of the payload (decoded from the documented layout, within the documented bounds), of
//! invalid inputs, and of the page in a real browser against our renders.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "numbers of payloads that the tests generate"
)]

mod bounds;
mod browser;
mod decoder;
mod hostile;
mod mutated_payloads;
mod still;
