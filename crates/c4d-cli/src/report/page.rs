//! [`Page`]: the HTML around the sections of a report.

use std::fmt::Write as _;

/// Largest page, bytes: small enough to send by mail and to open quickly in a browser.
pub(crate) const MAX_BYTES: usize = 10_000_000;

/// A page being written.
#[derive(Debug, Default)]
pub(crate) struct Page {
    body: String,
}

impl Page {
    /// Adds a section, unless its content is empty.
    pub(crate) fn section(&mut self, id: &str, title: &str, content: &str) {
        if !content.is_empty() {
            let _ = writeln!(
                self.body,
                "<section id=\"{id}\"><h2>{}</h2>{content}</section>",
                escape(title)
            );
        }
    }

    /// The whole file.
    pub(crate) fn html(&self, title: &str, subtitle: &str) -> String {
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{0}</title>\n<style>\n{1}</style>\n</head>\n<body>\n<h1>{0}</h1>\n<p class=\"subtitle\">{2}</p>\n{3}\
             <script>\n{4}</script>\n</body>\n</html>\n",
            escape(title),
            include_str!("../../report/style.css"),
            escape(subtitle),
            self.body,
            include_str!("../../report/wipe.js"),
        )
    }
}

/// Escapes text for HTML.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_complete_and_safe() {
        let mut page = Page::default();
        page.section("a", "A & B", "<p>x</p>");
        page.section("b", "empty", "");
        let html = page.html("<run>", "\"quoted\"");
        assert!(
            html.contains("<title>&lt;run&gt;</title>") && html.contains("A &amp; B"),
            "{html}"
        );
        assert!(!html.contains("id=\"b\""), "empty sections are left out");
        assert!(html.ends_with("</html>\n"), "complete");
        assert!(!html.contains("http://") && !html.contains("https://"), "nothing to fetch");
    }
}
