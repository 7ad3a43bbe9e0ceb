//! A file that is written from its start to its end and knows how long it is.

use std::fs::File;
use std::io::{BufWriter, Result, Seek, SeekFrom, Write};

/// A new file behind a buffer. Where it is is asked once a channel and chunk, and a [`BufWriter`] alone then asks the
/// system, after it has emptied its buffer: with thousands of channels a seventh of a recorder's time.
pub(crate) struct Appended {
    buffer: BufWriter<File>,
    position: u64,
}

impl Appended {
    /// To be written from the start of `file`.
    pub(crate) fn new(file: File) -> Self {
        Self {
            buffer: BufWriter::new(file),
            position: 0,
        }
    }

    /// Brings all to the disk, not to the system's cache alone.
    pub(crate) fn sync(mut self) -> Result<()> {
        self.buffer.flush()?;
        self.buffer.get_ref().sync_all()
    }
}

impl Write for Appended {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        let written = self.buffer.write(bytes)?;
        self.position += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> Result<()> {
        self.buffer.flush()
    }
}

impl Seek for Appended {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        if to != SeekFrom::Current(0) {
            self.position = self.buffer.seek(to)?;
        }
        Ok(self.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_knows_where_it_is_as_the_file_does() {
        let path = std::env::temp_dir().join(format!("plumage-appended-{}", std::process::id()));
        let mut file = Appended::new(File::create(&path).unwrap());
        file.write_all(b"one two").unwrap();
        assert_eq!(file.stream_position().unwrap(), 7);
        assert_eq!(
            std::fs::metadata(&path).unwrap().len(),
            0,
            "not yet written"
        );
        assert_eq!(file.seek(SeekFrom::Start(4)).unwrap(), 4);
        file.write_all(b"TWO three").unwrap();
        assert_eq!(file.stream_position().unwrap(), 13);
        assert_eq!(file.seek(SeekFrom::End(0)).unwrap(), 13);
        file.sync().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"one TWO three");
        std::fs::remove_file(&path).unwrap();
    }
}
