//! Text from outside, such as a vehicle's status texts or the content of a file in an error, made fit to be shown: a
//! terminal, a log or a page that gets it raw obeys the escape sequences in it.

use std::borrow::Cow;

/// Whether a character changes how the text around it is shown, instead of being shown: the control characters C0,
/// DEL and C1, line and paragraph separators, and the marks, embeddings, overrides and isolates of writing direction
/// (Unicode Standard Annex 9, table 4), which let a text read otherwise than it is.
fn is_control(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{61C}' | '\u{200E}' | '\u{200F}' | '\u{2028}'..='\u{202E}' | '\u{2066}'..='\u{2069}' | '\u{FEFF}')
}

/// `text` on one line, with every control character as its escape, such as `\u{1b}` or `\n`.
///
/// ```
/// use protocol::text::printable;
///
/// assert_eq!(printable("low \u{1b}[2Jbattery\n"), r"low \u{1b}[2Jbattery\n");
/// assert_eq!(printable("Höhe 12 m"), "Höhe 12 m");
/// ```
pub fn printable(text: &str) -> Cow<'_, str> {
    escape(text, is_control)
}

/// The same for text of several lines: line feeds and tabs stay.
pub fn printable_lines(text: &str) -> Cow<'_, str> {
    escape(text, |c| is_control(c) && c != '\n' && c != '\t')
}

fn escape(text: &str, hidden: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&hidden) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if hidden(c) {
            shown.extend(c.escape_default());
        } else {
            shown.push(c);
        }
    }
    Cow::Owned(shown)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_a_terminal_would_obey_is_shown() {
        // Clear the screen, set the title, C1's CSI, delete, and an override that reverses what follows.
        for (raw, shown) in [
            ("\u{1b}[2Jgone", r"\u{1b}[2Jgone"),
            ("\u{1b}]0;title\u{7}", r"\u{1b}]0;title\u{7}"),
            ("\u{9b}31m", r"\u{9b}31m"),
            ("a\u{7f}\u{8}b\r", r"a\u{7f}\u{8}b\r"),
            ("x\u{202e}gpj.exe", r"x\u{202e}gpj.exe"),
            ("\u{2066}a\u{2069}\u{2028}", r"\u{2066}a\u{2069}\u{2028}"),
        ] {
            assert_eq!(printable(raw), shown);
        }
        assert_eq!(printable("a\tb\n"), r"a\tb\n");
        assert_eq!(printable_lines("a\tb\n\u{1b}[1m"), "a\tb\n\\u{1b}[1m");
    }

    proptest! {
        /// Nothing that is shown controls anything, what is shown is shown as it is, and showing it twice changes nothing.
        #[test]
        fn any_text_is_fit_to_be_shown(text in any::<String>()) {
            let shown = printable(&text).into_owned();
            prop_assert!(!shown.chars().any(is_control));
            prop_assert_eq!(printable(&shown), shown.as_str());
            let plain: String = text.chars().filter(|c| !is_control(*c)).collect();
            prop_assert_eq!(printable(&plain), plain.as_str());
        }
    }
}
