//! Words for people, one object for machines, progress for terminals.

use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::Value;

use crate::import::Notice;

/// Where messages go.
#[derive(Clone, Copy)]
pub(crate) struct Say {
    json: bool,
    quiet: bool,
}

impl Say {
    pub fn new(json: bool, quiet: bool) -> Self {
        Self { json, quiet }
    }

    /// A line for people.
    pub fn line(&self, text: impl AsRef<str>) {
        if !self.quiet {
            eprintln!("{}", text.as_ref());
        }
    }

    /// What an importer repaired. Ten lines at most, so that a large file does not flood.
    pub fn notices(&self, file: &str, notices: &[Notice]) {
        const SHOWN: usize = 10;
        for notice in notices.iter().take(SHOWN) {
            self.line(format!("note: {file}{}: {}", notice.place, notice.text));
        }
        if notices.len() > SHOWN {
            let more = notices.len() - SHOWN;
            self.line(format!(
                "note: {file}: {more} more (sinew inspect --json shows all)"
            ));
        }
    }

    pub fn error(&self, text: &str) {
        eprintln!("error: {text}");
    }

    /// The command's result, for machines.
    pub fn object(&self, object: &Value) {
        if self.json {
            println!("{object:#}");
        }
    }

    /// A line on a terminal that the next one replaces; nothing elsewhere.
    pub fn transient(&self, text: &str) {
        if !self.quiet && std::io::stderr().is_terminal() {
            eprint!("\r\x1b[2K{text}");
        }
    }

    /// A bar on a terminal, nothing elsewhere.
    pub fn progress(&self, what: &'static str, count: usize) -> ProgressBar {
        let bar = ProgressBar::new(count as u64);
        if self.quiet || !std::io::stderr().is_terminal() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        let style = ProgressStyle::with_template("{msg:>12} [{bar:40}] {pos}/{len} {eta}");
        if let Ok(style) = style {
            bar.set_style(style);
        }
        bar.with_message(what)
    }
}

/// Notices as JSON.
pub(crate) fn notices_json(notices: &[Notice]) -> Value {
    let text = |notice: &Notice| format!("{}: {}", notice.place, notice.text);
    let text = |notice| Value::from(text(notice).trim_start_matches([':', ' ']));
    Value::Array(notices.iter().map(text).collect())
}

/// A count of bytes for people.
pub(crate) fn bytes(count: usize) -> String {
    let count = count as f64;
    if count < 10_000.0 {
        format!("{count} B")
    } else if count < 1e6 * 1.024 {
        format!("{:.1} KiB", count / 1024.0)
    } else {
        format!("{:.2} MiB", count / (1024.0 * 1024.0))
    }
}

/// A count with its thousands apart.
pub(crate) fn thousands(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_for_people() {
        assert_eq!(thousands(7), "7");
        assert_eq!(thousands(1_234_567), "1,234,567");
        assert_eq!(bytes(96), "96 B");
        assert_eq!(bytes(102_400), "100.0 KiB");
        assert_eq!(bytes(3 << 20), "3.00 MiB");
    }
}
