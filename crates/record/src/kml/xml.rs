//! The elements of KML that several features are made of.

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};

/// What writing comes to.
pub type Written = std::io::Result<()>;

/// A document that is being written.
pub struct Xml(Writer<Vec<u8>>);

impl Xml {
    /// An empty document.
    pub fn new() -> Self {
        Self(Writer::new_with_indent(Vec::new(), b' ', 0))
    }

    /// The document around what `inner` writes.
    pub fn document(&mut self, inner: impl FnOnce(&mut Self) -> Written) -> Written {
        self.0
            .write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
        let spaces = [
            ("xmlns", "http://www.opengis.net/kml/2.2"),
            ("xmlns:gx", "http://www.google.com/kml/ext/2.2"),
        ];
        self.within("kml", &spaces, |xml| xml.within("Document", &[], inner))
    }

    /// The text that was written.
    pub fn finish(self) -> Result<String, std::string::FromUtf8Error> {
        String::from_utf8(self.0.into_inner())
    }

    /// An element around what `inner` writes.
    pub fn within(
        &mut self,
        name: &str,
        attributes: &[(&str, &str)],
        inner: impl FnOnce(&mut Self) -> Written,
    ) -> Written {
        let begin = BytesStart::new(name).with_attributes(attributes.iter().copied());
        self.0.write_event(Event::Start(begin))?;
        inner(self)?;
        self.0.write_event(Event::End(BytesEnd::new(name)))
    }

    /// An element that holds text.
    pub fn text(&mut self, name: &str, text: &str) -> Written {
        self.0.write_event(Event::Start(BytesStart::new(name)))?;
        self.0.write_event(Event::Text(BytesText::new(text)))?;
        self.0.write_event(Event::End(BytesEnd::new(name)))
    }

    /// A folder with a name.
    pub fn folder(&mut self, name: &str, inner: impl FnOnce(&mut Self) -> Written) -> Written {
        self.within("Folder", &[], |xml| {
            xml.text("name", name)?;
            inner(xml)
        })
    }

    /// A feature with a name; `inner` keeps to the schema's order: description, time, style, data, geometry.
    pub fn placemark(&mut self, name: &str, inner: impl FnOnce(&mut Self) -> Written) -> Written {
        self.within("Placemark", &[], |xml| {
            xml.text("name", name)?;
            inner(xml)
        })
    }

    /// Names with values.
    pub fn data(&mut self, pairs: &[(&str, &str)]) -> Written {
        self.within("ExtendedData", &[], |xml| {
            pairs.iter().try_for_each(|(name, value)| {
                xml.within("Data", &[("name", name)], |xml| xml.text("value", value))
            })
        })
    }

    /// How a line looks.
    pub fn line(&mut self, colour: &str, width: u32) -> Written {
        self.within("LineStyle", &[], |xml| {
            xml.text("color", colour)?;
            xml.text("width", &width.to_string())
        })
    }

    /// A style of lines alone.
    pub fn line_style(&mut self, id: &str, colour: &str, width: u32) -> Written {
        self.within("Style", &[("id", id)], |xml| xml.line(colour, width))
    }

    /// How a point looks.
    pub fn icon(&mut self, colour: &str, scale: f64, href: &str) -> Written {
        self.within("IconStyle", &[], |xml| {
            xml.text("color", colour)?;
            xml.text("scale", &scale.to_string())?;
            xml.within("Icon", &[], |xml| xml.text("href", href))
        })
    }
}
