//! plotly.js as text, out of the crate that carries it.

use std::sync::LazyLock;

/// The minified plotly.js, safe inside a `<script>` element.
///
/// The crate hands it out in a script element, followed by one with MathJax, which is not needed
/// here and would make every report half again as large.
pub(crate) fn text() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| {
        let scripts = plotly::Plot::offline_js_sources();
        let from = scripts.find('>').map_or(0, |at| at + 1);
        let to = scripts.find("</script>").unwrap_or(scripts.len());
        scripts.get(from..to).unwrap_or_default().to_owned()
    });
    &TEXT
}

#[cfg(test)]
mod tests {
    #[test]
    fn it_is_plotly_whole_and_alone() {
        let text = super::text();
        assert!(text.contains("plotly.js v3"), "{}", &text[..200]);
        assert!(text.len() > 3_000_000, "{}", text.len());
        assert!(text.contains("newPlot") && !text.contains("MathJax ="));
        assert!(text.trim_end().ends_with(['}', ';', ')']));
    }
}
