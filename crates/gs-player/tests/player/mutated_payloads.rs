//! The player's decoder, in headless Chromium, on randomly mutated payloads: it decodes them or
//! rejects them with its own error, in bounded time.

use crate::browser::browser;
use crate::still::{Frames, row_of};
use gs_player::{EncodeOptions, encode};
use std::fmt::Write;
use std::io::Read;
use std::process::{Command, Stdio};

const DECODER: &str = include_str!("../../player/decode.js");

/// Mutates a payload repeatedly (header values, or bytes
/// anywhere), decodes it, and reports problems.
const HARNESS: &str = r#"
let state = 1;
function random(below) {
  state ^= state << 13; state ^= state >>> 17; state ^= state << 5;
  return (state >>> 0) % below;
}
const ODD = [0, 1, -1, 2, 3, 7, 255, 65535, 65536, 1e6, 2147483647, 4294967295, 1e300, 0.5, null, "x", [], {}, true];
function changeHeader(bytes) {
  const view = new DataView(bytes.buffer);
  const length = view.getUint32(8, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(12, 12 + length)));
  for (let times = 1 + random(2); times > 0; times--) {
    let at = header;
    for (;;) {
      const keys = Object.keys(at);
      if (keys.length === 0) break;
      const key = keys[random(keys.length)];
      const inner = at[key];
      if (inner !== null && typeof inner === "object" && random(8) > 0) { at = inner; continue; }
      at[key] = random(2) && typeof inner === "number" ? inner + random(3) - 1 : ODD[random(ODD.length)];
      break;
    }
  }
  const text = new TextEncoder().encode(JSON.stringify(header));
  const changed = new Uint8Array(12 + text.length + bytes.length - 12 - length);
  changed.set(bytes.subarray(0, 12));
  changed.set(text, 12);
  changed.set(bytes.subarray(12 + length), 12 + text.length);
  new DataView(changed.buffer).setUint32(8, text.length, true);
  return changed;
}
function changeBytes(bytes) {
  const changed = bytes.slice(0, random(4) ? bytes.length : random(bytes.length));
  for (let times = random(4); times > 0 && changed.length > 0; times--) changed[random(changed.length)] = random(256);
  return changed;
}
const tally = { tried: 0, read: 0, refused: 0, problems: [] };
readPayload(PAYLOAD.slice());
const end = performance.now() + MILLISECONDS;
while (performance.now() < end && tally.problems.length < 3) {
  const seed = state;
  const bytes = random(2) ? changeHeader(PAYLOAD.slice()) : changeBytes(PAYLOAD);
  const begun = performance.now();
  tally.tried++;
  try {
    const { header, rows, attributes } = readPayload(bytes);
    for (const name of Object.keys(attributes)) {
      const attribute = attributes[name];
      if (attribute.base.length !== attribute.rows * attribute.channels) tally.problems.push(`${seed}: rows of ${name}`);
      if (attribute.knotFrames.some((frame) => frame >= header.frames)) tally.problems.push(`${seed}: frames of ${name}`);
    }
    tally.read++;
  } catch (error) {
    if (error.constructor === Error) tally.refused++;
    else tally.problems.push(`${seed}: ${error.name}: ${error.message}`);
  }
  if (performance.now() - begun > 15000) tally.problems.push(`${seed}: slow`);
}
document.body.textContent = "TALLY" + JSON.stringify(tally) + "END";
"#;

#[test]
fn mutated_payloads_are_decoded_or_refused() {
    let mut frames = vec![row_of(40); 6];
    for (time, frame) in frames.iter_mut().enumerate() {
        for row in (0..40).step_by(3) {
            frame.means[row][1] += 0.3 * (time * time) as f32;
            frame.quats[row] = [1.0, 0.1 * time as f32, 0.0, 0.0];
        }
    }
    let times = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];
    let encoded =
        encode(&Frames(frames), None, &times, &EncodeOptions::default(), &mut |_, _| {}).unwrap();
    let mut payload = Vec::new();
    flate2::read::GzDecoder::new(&encoded.payload[..]).read_to_end(&mut payload).unwrap();
    let mut bytes = String::new();
    for byte in payload {
        write!(bytes, "{byte},").unwrap();
    }
    let seconds = std::env::var("C4D_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok());
    let milliseconds: f64 = 1000.0 * seconds.unwrap_or(3.0);
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("page.html");
    let text = format!(
        "<!doctype html><meta charset=utf-8><body><script>{DECODER}\nconst PAYLOAD = new Uint8Array([{bytes}]);\nconst MILLISECONDS = {milliseconds};\n{HARNESS}</script>"
    );
    std::fs::write(&page, text).unwrap();
    let output = Command::new(browser())
        .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
        .args(["--disable-extensions", "--no-first-run", "--disable-background-networking"])
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg("--dump-dom")
        .arg(format!("file://{}", page.display()))
        .stderr(Stdio::null())
        .output()
        .unwrap();
    let document = String::from_utf8_lossy(&output.stdout).into_owned();
    let tally = document.split_once("TALLY").and_then(|(_, rest)| rest.split_once("END"));
    let tally = tally.unwrap_or_else(|| panic!("the decoder ended the page: {document}")).0;
    let tally: serde_json::Value = serde_json::from_str(&tally.replace("&amp;", "&")).unwrap();
    eprintln!("{tally}");
    assert_eq!(tally["problems"].as_array().unwrap().len(), 0, "{tally}");
    let count = |key: &str| tally[key].as_u64().unwrap();
    assert!(count("read") > 10 && count("refused") > 10, "both happen: {tally}");
}
