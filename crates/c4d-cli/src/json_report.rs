//! `--json`: the report of a command, as one object on standard output.

use crate::failure::Failure;
use serde_json::{Map, Value, json};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Collects a command's report, outputs and messages until it ends.
#[derive(Debug, Default)]
pub(crate) struct JsonReport(Mutex<Parts>);

#[derive(Debug, Default)]
struct Parts {
    report: Map<String, Value>,
    outputs: Vec<Value>,
    messages: Vec<Value>,
}

impl JsonReport {
    /// Adds the command's own keys to the object; keys of earlier calls are overwritten only if
    /// they are the same.
    pub(crate) fn report(&self, keys: Value) {
        if let Value::Object(keys) = keys {
            self.parts().report.extend(keys);
        }
    }

    /// A file or folder that was written.
    pub(crate) fn output(&self, path: &Path, counts: &[(&str, usize)]) {
        let mut output = Map::from_iter([("path".to_owned(), json!(path))]);
        output.extend(counts.iter().map(|(name, count)| ((*name).to_owned(), json!(count))));
        self.parts().outputs.push(Value::Object(output));
    }

    /// A message; `kind` is note or warning.
    pub(crate) fn message(&self, kind: &str, text: &str) {
        self.parts().messages.push(json!({ "kind": kind, "text": text }));
    }

    /// The object: the command's own keys, `outputs`, `messages` and, if it failed, `error`.
    pub(crate) fn document(&self, failure: Option<&Failure>) -> Value {
        let mut parts = self.parts();
        let parts = std::mem::take(&mut *parts);
        let mut object = parts.report;
        object.insert("outputs".to_owned(), Value::Array(parts.outputs));
        object.insert("messages".to_owned(), Value::Array(parts.messages));
        if let Some(failure) = failure {
            let error = json!({
                "what": failure.what,
                "next": failure.next_step(),
                "exit_code": failure.exit as u8,
            });
            object.insert("error".to_owned(), error);
        }
        Value::Object(object)
    }

    fn parts(&self) -> MutexGuard<'_, Parts> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_object_has_report_outputs_messages_and_error() {
        let report = JsonReport::default();
        report.report(json!({ "splats": 3, "time": 0.0 }));
        report.report(json!({ "splats": 4 }));
        report.output(Path::new("out.ply"), &[("splats", 4)]);
        report.message("warning", "half of it");
        let expected = json!({
            "splats": 4,
            "time": 0.0,
            "outputs": [{ "path": "out.ply", "splats": 4 }],
            "messages": [{ "kind": "warning", "text": "half of it" }],
        });
        assert_eq!(report.document(None), expected, "success");
        let failure = Failure::usage("no").next("yes");
        let error = &report.document(Some(&failure))["error"];
        assert_eq!(error, &json!({ "what": "no", "next": "yes", "exit_code": 2 }), "failure");
    }
}
