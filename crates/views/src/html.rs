//! Pieces of HTML that the reports share.

use crate::figure::{Figure, intervals};
pub(crate) use formats::number::fixed as number;
use std::fmt::Write as _;

/// `text` with the characters that HTML gives a meaning, and those that would change how the rest is shown, replaced.
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in protocol::text::printable_lines(text).chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            other => escaped.push(other),
        }
    }
    escaped
}

/// JSON that may stand inside a script element: no text in it can close the element.
fn script_json(figures: &[Figure]) -> String {
    // A structure of texts and numbers has no part that JSON cannot hold.
    let text = serde_json::to_string(figures).unwrap_or_default();
    // `</script>` and `<!--` end or change a script element wherever they stand, in strings too.
    text.replace('<', "\\u003c")
}

/// Characters of a number with its ± or interval; a sentence may begin with a number, too.
const LONGEST_NUMBER: usize = 30;
/// Columns of a table that fit on a page in the usual size.
const MOST_USUAL_COLUMNS: usize = 10;
/// Characters of a cell with a range that stays on one line.
const LONGEST_RANGE: usize = 16;

/// The modules behind the figures of a report, each after those that it uses.
const MODULES: [&str; 8] = [
    include_str!("../assets/scale.js"),
    include_str!("../assets/grid.js"),
    include_str!("../assets/svg.js"),
    include_str!("../assets/chart_axes.js"),
    include_str!("../assets/chart_layers.js"),
    include_str!("../assets/chart.js"),
    include_str!("../assets/chart_pointer.js"),
    include_str!("../assets/report.js"),
];

/// The modules as one: a page that is opened from a file cannot import any, so that the lines with imports go.
fn script() -> String {
    let lines = MODULES.iter().flat_map(|module| module.lines());
    let kept = lines.filter(|line| !line.starts_with("import "));
    kept.flat_map(|line| [line, "\n"]).collect()
}

/// How a report was made, which is written below its title.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Origin {
    /// The program's version.
    pub version: String,
    /// When the report was made (RFC 3339, UTC).
    pub made: String,
    /// The command that made it.
    pub command: String,
    /// Names of the files that were read, with their SHA-256.
    pub inputs: Vec<(String, String)>,
}

/// A report: sections with figures and tables, numbered as they come.
#[derive(Debug)]
pub struct Document {
    kicker: String,
    title: String,
    body: String,
    drawn: Vec<Figure>,
    sections: usize,
    tables: usize,
}

impl Document {
    /// An empty document. `kicker` stands small above the title.
    pub fn new(kicker: &str, title: &str) -> Self {
        Self {
            kicker: kicker.to_owned(),
            title: title.to_owned(),
            body: String::new(),
            drawn: Vec::new(),
            sections: 0,
            tables: 0,
        }
    }

    /// The abstract, for a reader who reads nothing else: what was done, what came out, and how far to rely on it, a
    /// sentence each.
    pub fn lead(&mut self, sentences: &[String; 3]) {
        let [done, found, worth] = sentences.each_ref().map(|s| escape(s));
        self.push(format_args!(
            "<section class=\"lead\"><p>{done}</p><p class=\"headline\">{found}</p><p>{worth}</p></section>\n"
        ));
    }

    /// Large figures in a row: value, unit, label.
    pub fn cards<U: AsRef<str>>(&mut self, cards: &[(String, U, String)]) {
        self.body.push_str("<div class=\"cards\">");
        for (value, unit, label) in cards {
            let (value, unit, label) = (escape(value), escape(unit.as_ref()), escape(label));
            self.push(format_args!(
                "<div class=\"card\"><b>{value}<small> {unit}</small></b><span>{label}</span></div>"
            ));
        }
        self.body.push_str("</div>\n");
    }

    /// A numbered section heading.
    pub fn section(&mut self, heading: &str) {
        self.sections += 1;
        let (number, heading) = (self.sections, escape(heading));
        self.push(format_args!("<h2><span>{number}</span> {heading}</h2>\n"));
    }

    /// A paragraph of plain text.
    pub fn paragraph(&mut self, text: &str) {
        let text = escape(text);
        self.push(format_args!("<p>{text}</p>\n"));
    }

    /// A list of plain texts.
    pub fn list(&mut self, items: &[String]) {
        self.body.push_str("<ul>");
        for item in items {
            let item = escape(item);
            self.push(format_args!("<li>{item}</li>"));
        }
        self.body.push_str("</ul>\n");
    }

    /// A figure with a caption.
    pub(crate) fn figure(&mut self, figure: Figure, caption: &str) {
        self.drawn.push(figure);
        let (number, caption) = (self.drawn.len(), escape(caption));
        self.push(format_args!(
            "<figure><div class=\"plot\" id=\"figure-{number}\"></div>\
             <figcaption><b>Figure {number}.</b> {caption}</figcaption></figure>\n"
        ));
    }

    /// A table with a caption; smaller where it has many columns. Columns of numbers stand to the right, the first column and texts to the left.
    pub fn table(&mut self, caption: &str, head: &[&str], rows: &[Vec<String>]) {
        self.tables += 1;
        let (number, caption) = (self.tables, escape(caption));
        self.push(format_args!(
            "<figure class=\"table\"><figcaption><b>Table {number}.</b> {caption}</figcaption>\
             <div class=\"scroll\"><table{}><thead><tr>",
            if head.len() > MOST_USUAL_COLUMNS {
                " class=\"wide\""
            } else {
                ""
            }
        ));
        let sides: Vec<&str> = (0..head.len()).map(|k| side(rows, k)).collect();
        for (cell, side) in head.iter().zip(&sides) {
            let cell = escape(cell);
            self.push(format_args!("<th{side}>{cell}</th>"));
        }
        self.body.push_str("</tr></thead><tbody>");
        for row in rows {
            self.body.push_str("<tr>");
            for (cell, side) in row.iter().zip(&sides) {
                // A value and its ± stay on one line, and so do both ends of a range.
                let cell = escape(cell).replace(" ± ", "\u{a0}±\u{a0}");
                let is_range = cell.len() <= LONGEST_RANGE && cell.contains(" to ");
                let cell = if is_range {
                    cell.replace(' ', "\u{a0}")
                } else {
                    cell
                };
                self.push(format_args!("<td{side}>{cell}</td>"));
            }
            self.body.push_str("</tr>");
        }
        self.body.push_str("</tbody></table></div></figure>\n");
    }

    /// A figure of values with their intervals, a row each: name, value, low and high.
    pub fn intervals(&mut self, caption: &str, axis: (&str, &str), rows: &[(String, [f64; 3])]) {
        self.figure(intervals(axis, rows), caption);
    }

    /// The whole page, with style, figures and the script that draws these: one file that needs no other.
    pub fn html(&self, origin: &Origin) -> String {
        format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
             <title>{title}</title><style>{style}</style></head><body><main>\n{header}{body}</main>\n\
             <script type=\"application/json\" id=\"figures\">{figures}</script>\n\
             <script type=\"module\">\n{script}</script>\n</body></html>\n",
            title = escape(&self.title),
            style = concat!(
                include_str!("../assets/report.css"),
                include_str!("../assets/chart.css")
            ),
            header = self.header(origin),
            body = self.body,
            figures = script_json(&self.drawn),
            script = script(),
        )
    }

    fn header(&self, origin: &Origin) -> String {
        let (kicker, heading) = (escape(&self.kicker), escape(&self.title));
        let made = [
            ("Plumage", &origin.version),
            ("made", &origin.made),
            ("by", &origin.command),
        ];
        let made = made.iter().filter(|(_, what)| !what.is_empty());
        let made: Vec<String> = made
            .map(|(by, what)| format!("{by} {}", escape(what)))
            .collect();
        let input = |(file, sha256): &(String, String)| {
            format!("<br>{}: SHA-256 {}", escape(file), escape(sha256))
        };
        let inputs: String = origin.inputs.iter().map(input).collect();
        format!(
            "<header><p class=\"kicker\">{kicker}</p><h1>{heading}</h1><p class=\"origin\">{}{inputs}</p></header>\n",
            made.join(", ")
        )
    }

    fn push(&mut self, arguments: std::fmt::Arguments<'_>) {
        // Writing into a String cannot fail.
        let _ = self.body.write_fmt(arguments);
    }
}

/// The attribute of the cells of column `k`: of numbers where most cells that say something begin with one.
fn side(rows: &[Vec<String>], k: usize) -> &'static str {
    let cells = rows.iter().filter_map(|row| row.get(k));
    let (mut numbers, mut texts) = (0, 0);
    for cell in cells.filter(|cell| !matches!(cell.as_str(), "" | "–")) {
        let is_number = cell.starts_with(|c: char| c.is_ascii_digit() || "+-±<>≤≥".contains(c));
        match is_number && cell.chars().count() <= LONGEST_NUMBER {
            true => numbers += 1,
            false => texts += 1,
        }
    }
    if texts > 0 && texts >= numbers {
        " class=\"text\""
    } else {
        ""
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_breaks_out_of_its_place() {
        let nasty = "</script><script>alert(1)</script> & \"x\"";
        let mut document = Document::new(nasty, nasty);
        document.section(nasty);
        document.paragraph(nasty);
        document.table(nasty, &[nasty], &[vec![nasty.to_owned()]]);
        let panel = crate::figure::Panel {
            title: nasty.to_owned(),
            ..Default::default()
        };
        let figure = Figure {
            panels: vec![panel],
            ..Figure::default()
        };
        document.figure(figure, nasty);
        let page = document.html(&Origin {
            command: nasty.to_owned(),
            ..Origin::default()
        });
        assert!(!page.contains("alert(1)</script>"));
        assert_eq!(page.matches("</script>").count(), 2);
    }

    #[test]
    fn columns_of_texts_stand_to_the_left() {
        let mut document = Document::new("", "");
        let row = |texts: [&str; 4]| texts.map(str::to_owned).to_vec();
        let rows = [
            row(["1", "real", "-3", "–"]),
            row(["2", "4 of 5", "10 to 20", ""]),
        ];
        document.table("", &["id", "kind", "size", "none"], &rows);
        let page = document.html(&Origin::default());
        assert!(page.contains("<td>1</td><td class=\"text\">real</td><td>-3</td><td>–</td>"));
        assert!(page.contains("<td>10\u{a0}to\u{a0}20</td>"));
    }

    #[test]
    fn what_is_no_number_is_a_dash() {
        assert_eq!(number(f64::NAN, 1), "–");
        assert_eq!(number(-0.25, 1), "-0.2");
        assert_eq!(number(-0.04, 1), "0.0");
        assert_eq!(number(-10.0, 0), "-10");
    }
}
