//! The records of an MCAP file, chunks unpacked. What is damaged costs the chunk that it is in and no more; it is
//! counted, and never read as data.
//!
//! Format: mcap.dev, *Specification*. A record is a byte that says its kind, its length in eight bytes and its
//! content. Where that chain is broken the next chunk is looked for: its header says its length twice.

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError, parse_record};
use std::collections::VecDeque;
use std::io::Read;

/// Largest record or chunk that is read, bytes: no file can make a reader allocate more.
const RECORD_LIMIT: usize = 1 << 28;
/// Bytes of a record before its content.
const HEAD: usize = 9;
/// Bytes of a chunk's content before the name of its compression, and between that and its records.
const CHUNK_HEAD: [usize; 2] = [32, 8];
/// Bytes that are read at a time.
const BLOCK: usize = 1 << 16;

/// Why records cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordsError {
    /// The bytes do not begin as an MCAP file.
    #[error("it is not an MCAP file")]
    NoMcap,
    /// The system could not read on.
    #[error(transparent)]
    Read(#[from] std::io::Error),
}

/// What was damaged in a file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Damage {
    /// Chunks and records that are left out.
    pub places: u64,
    /// Byte at which the first of them begins, or before which it is where that is not known.
    pub first_byte: u64,
}

impl Damage {
    /// What is damaged, in words; nothing where nothing is.
    pub fn words(&self) -> Option<String> {
        let what = match self.places {
            0 => return None,
            1 => "in one place".to_owned(),
            more => format!("in {more} places"),
        };
        Some(format!(
            "damaged {what}, first at byte {}; the damaged records are skipped",
            self.first_byte
        ))
    }

    fn at(&mut self, byte: u64) {
        if self.places == 0 {
            self.first_byte = byte;
        }
        self.places += 1;
    }
}

/// How a file ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// It was not read to its end.
    Ahead,
    /// Its data section was closed.
    Whole,
    /// It breaks off.
    CutShort,
}

/// Reads records one after the other.
pub struct Records<R> {
    source: R,
    /// Bytes that were read and not used.
    buffer: Vec<u8>,
    /// Bytes used of the buffer.
    used: usize,
    /// Bytes of the file before the buffer.
    before: u64,
    checksum: crc32fast::Hasher,
    /// Records of the present chunk.
    inside: VecDeque<Record<'static>>,
    /// Whether chunks are passed over.
    outside_only: bool,
    /// Whether there were chunks.
    chunked: bool,
    damage: Damage,
    end: End,
}

impl<R: Read> Records<R> {
    /// Begins to read.
    ///
    /// # Errors
    /// [`RecordsError`].
    pub fn new(source: R) -> Result<Self, RecordsError> {
        let mut records = Self {
            source,
            buffer: Vec::new(),
            used: 0,
            before: 0,
            checksum: crc32fast::Hasher::new(),
            inside: VecDeque::new(),
            outside_only: false,
            chunked: false,
            damage: Damage::default(),
            end: End::Ahead,
        };
        if !records.has(MAGIC.len())? || records.ahead()[..MAGIC.len()] != *MAGIC {
            return Err(RecordsError::NoMcap);
        }
        records.pass(MAGIC.len());
        Ok(records)
    }

    /// Passes over chunks: for metadata and attachments, which stand outside of them.
    pub fn outside_chunks(mut self) -> Self {
        self.outside_only = true;
        self
    }

    /// What was damaged in what was read so far.
    pub fn damage(&self) -> &Damage {
        &self.damage
    }

    /// How the file ends, once it was read.
    pub fn end(&self) -> End {
        self.end
    }

    /// Bytes of the file that were used.
    pub fn bytes(&self) -> u64 {
        self.before + self.used as u64
    }

    /// The next record of the data section; none at its end.
    ///
    /// # Errors
    /// [`RecordsError::Read`].
    pub fn record(&mut self) -> Result<Option<Record<'static>>, RecordsError> {
        loop {
            if let Some(record) = self.inside.pop_front() {
                return Ok(Some(record));
            }
            if self.end != End::Ahead {
                return Ok(None);
            }
            if let Some(record) = self.outer()? {
                return Ok(Some(record));
            }
        }
    }

    /// What stands behind the data section of a whole file: channels and schemas once more, and the index.
    ///
    /// # Errors
    /// [`RecordsError::Read`].
    pub fn summary(&mut self) -> Result<Vec<Record<'static>>, RecordsError> {
        if self.end != End::Whole {
            return Ok(Vec::new());
        }
        // As much as there is: fewer bytes than the limit end the file.
        self.has(RECORD_LIMIT)?;
        Ok(flat(self.ahead()).map(Record::into_owned).collect())
    }

    /// The next record outside of chunks; none where there is nothing to tell of it.
    fn outer(&mut self) -> Result<Option<Record<'static>>, RecordsError> {
        if !self.has(HEAD)? {
            self.end = End::CutShort;
            return Ok(None);
        }
        let Some((kind, length)) = head(self.ahead()) else {
            return self.look_for_chunk();
        };
        // Cut short within the last record, or its length is damaged.
        if !self.has(HEAD + length)? || !agrees_on_length(self.ahead(), kind, length) {
            return self.look_for_chunk();
        }
        let at = self.bytes();
        if kind == op::DATA_END {
            self.close(at);
            return Ok(None);
        }
        let record = &self.buffer[self.used..self.used + HEAD + length];
        let content = &record[HEAD..];
        let read = match kind {
            // Who writes chunks has all messages in them.
            op::MESSAGE if self.chunked => Err(McapError::UnexpectedEof),
            op::CHUNK if self.outside_only => Ok(None),
            op::CHUNK => unpacked(record).map(|inside| {
                self.inside = inside;
                None
            }),
            op::ATTACHMENT if !is_whole_attachment(content) => Err(McapError::UnexpectedEof),
            _ => parse_record(kind, content).map(|record| Some(record.into_owned())),
        };
        self.pass(HEAD + length);
        self.chunked |= kind == op::CHUNK;
        if read.is_err() {
            self.damage.at(at);
        }
        Ok(read.unwrap_or(None))
    }

    /// The end of the data section, with the checksum of all before.
    fn close(&mut self, at: u64) {
        let stated = match parse_record(op::DATA_END, &self.ahead()[HEAD..]) {
            Ok(Record::DataEnd(end)) => end.data_section_crc,
            _ => 0,
        };
        let found = self.checksum.clone().finalize();
        // Of a damaged chunk it is known already.
        if stated != 0 && stated != found && self.damage.places == 0 {
            self.damage.at(at);
        }
        self.end = End::Whole;
    }

    /// Goes to the next chunk; without one the file ends here.
    fn look_for_chunk(&mut self) -> Result<Option<Record<'static>>, RecordsError> {
        let at = self.bytes();
        loop {
            self.pass(1);
            if !self.has(HEAD)? {
                self.end = End::CutShort;
                return Ok(None);
            }
            let next = self.ahead().iter().position(|byte| *byte == op::CHUNK);
            let Some(next) = next else {
                self.pass(self.ahead().len());
                continue;
            };
            self.pass(next);
            self.has(HEAD + CHUNK_HEAD[0] + 16)?;
            if begins_chunk(self.ahead()) {
                self.damage.at(at);
                return Ok(None);
            }
        }
    }

    fn ahead(&self) -> &[u8] {
        &self.buffer[self.used..]
    }

    /// Whether `count` bytes are ahead, reading them if need be.
    fn has(&mut self, count: usize) -> Result<bool, RecordsError> {
        if self.ahead().len() >= count {
            return Ok(true);
        }
        self.buffer.drain(..self.used);
        self.before += self.used as u64;
        self.used = 0;
        while self.buffer.len() < count {
            let from = self.buffer.len();
            // No more than there was already: a length that is damaged costs no memory.
            let step = (count - from).clamp(BLOCK, BLOCK.max(from));
            self.buffer.resize(from + step, 0);
            let read = loop {
                match self.source.read(&mut self.buffer[from..]) {
                    Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                    read => break read?,
                }
            };
            self.buffer.truncate(from + read);
            if read == 0 {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn pass(&mut self, count: usize) {
        let to = (self.used + count).min(self.buffer.len());
        self.checksum.update(&self.buffer[self.used..to]);
        self.used = to;
    }
}

/// Kind and length of the record that begins here; none of what is no record.
fn head(bytes: &[u8]) -> Option<(u8, usize)> {
    let length = u64::from_le_bytes(bytes.get(1..HEAD)?.try_into().ok()?);
    let length = usize::try_from(length)
        .ok()
        .filter(|l| *l <= RECORD_LIMIT)?;
    (bytes[0] != 0).then_some((bytes[0], length))
}

/// The records that stand one behind the other in `bytes`; what cannot be read is passed over.
pub fn flat(bytes: &[u8]) -> impl Iterator<Item = Record<'_>> {
    let mut rest = bytes;
    let each = std::iter::from_fn(move || {
        let (kind, length) = head(rest)?;
        let content = rest.get(HEAD..HEAD + length)?;
        rest = &rest[HEAD + length..];
        Some(parse_record(kind, content))
    });
    each.filter_map(Result::ok)
}

/// Whether a record that says its length inside as well says the same there.
fn agrees_on_length(record: &[u8], kind: u8, length: usize) -> bool {
    match kind {
        op::CHUNK => begins_chunk(record),
        // Of a channel in two bytes, and entries behind their length in four.
        op::MESSAGE_INDEX => {
            let entries = record
                .get(HEAD + 2..HEAD + 6)
                .and_then(|b| b.try_into().ok());
            entries.is_some_and(|b| u32::from_le_bytes(b) as usize + 6 == length)
        }
        _ => true,
    }
}

/// Whether a chunk begins here, by the two lengths that it states and its compression.
fn begins_chunk(bytes: &[u8]) -> bool {
    let number = |at: usize, width: usize| -> Option<u64> {
        let bytes = bytes.get(at..at + width)?;
        Some(bytes.iter().rev().fold(0, |n, b| n << 8 | u64::from(*b)))
    };
    let told = || {
        let (kind, length) = head(bytes)?;
        let name_at = HEAD + CHUNK_HEAD[0];
        let name = usize::try_from(number(name_at - 4, 4)?)
            .ok()
            .filter(|n| *n <= 4)?;
        let known = matches!(bytes.get(name_at..name_at + name)?, b"" | b"lz4" | b"zstd");
        let packed = number(name_at + name, CHUNK_HEAD[1])?;
        let stated = packed.checked_add((CHUNK_HEAD[0] + name + CHUNK_HEAD[1]) as u64)?;
        Some(kind == op::CHUNK && known && stated == length as u64)
    };
    told() == Some(true)
}

/// The records of a chunk that is whole.
fn unpacked(chunk: &[u8]) -> Result<VecDeque<Record<'static>>, McapError> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        // Before a chunk is unpacked: a damaged one is left out whole, not half read.
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(RECORD_LIMIT);
    let mut reader = LinearReader::new_with_options(options);
    let mut rest = chunk;
    let mut inside = VecDeque::new();
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(need) => {
                let count = need.min(rest.len());
                // Its end is the chunk's own, and nothing is missing there.
                if count == 0 && rest.is_empty() {
                    break;
                }
                reader.insert(need)[..count].copy_from_slice(&rest[..count]);
                rest = &rest[count..];
                reader.notify_read(count);
            }
            LinearReadEvent::Record { data, opcode } => {
                inside.push_back(parse_record(opcode, data)?.into_owned());
            }
        }
    }
    Ok(inside)
}

/// Whether an attachment has the checksum that it states; 0 states none.
fn is_whole_attachment(content: &[u8]) -> bool {
    let Some((checked, stated)) = content.split_last_chunk::<4>() else {
        return false;
    };
    let stated = u32::from_le_bytes(*stated);
    stated == 0 || stated == crc32fast::hash(checked)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mcap::records::{MessageHeader, Metadata};
    use mcap::{Compression, WriteOptions};
    use proptest::prelude::*;
    use std::collections::BTreeMap;
    use std::io::Cursor;

    const MESSAGES: u32 = 60;
    const IN_CHUNK: u32 = 10;

    /// Messages in chunks of ten, with metadata behind them, as no program of ours writes it.
    fn file(compression: Option<Compression>) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        let mut writer = WriteOptions::new()
            .compression(compression)
            .create(&mut out)
            .unwrap();
        let channel = writer
            .add_channel(0, "/a", "json", &BTreeMap::new())
            .unwrap();
        for sequence in 0..MESSAGES {
            let time = u64::from(sequence);
            let header = MessageHeader {
                channel_id: channel,
                sequence,
                log_time: time,
                publish_time: time,
            };
            let text = format!("{{\"n\": {sequence}}}");
            writer
                .write_to_known_channel(&header, text.as_bytes())
                .unwrap();
            if sequence % IN_CHUNK == IN_CHUNK - 1 {
                writer.flush().unwrap();
            }
        }
        let metadata = BTreeMap::from([("a".to_owned(), "b".to_owned())]);
        writer
            .write_metadata(&Metadata {
                name: "last".to_owned(),
                metadata,
            })
            .unwrap();
        writer.finish().unwrap();
        drop(writer);
        out.into_inner()
    }

    /// Sequence numbers of the messages, whether the metadata came, and what is said of the file.
    fn read(bytes: &[u8]) -> (Vec<u32>, bool, Damage, End) {
        let mut records = Records::new(bytes).unwrap();
        let (mut messages, mut metadata) = (Vec::new(), false);
        while let Some(record) = records.record().unwrap() {
            match record {
                Record::Message { header, data } => {
                    let text = format!("{{\"n\": {}}}", header.sequence);
                    assert_eq!(*data, *text.as_bytes(), "damage read as data");
                    messages.push(header.sequence);
                }
                Record::Metadata(_) => metadata = true,
                _ => {}
            }
        }
        (messages, metadata, records.damage().clone(), records.end())
    }

    #[test]
    fn all_compressions_are_read_and_metadata_wherever_it_stands() {
        for compression in [None, Some(Compression::Zstd), Some(Compression::Lz4)] {
            let (messages, metadata, damage, end) = read(&file(compression));
            assert_eq!(messages, (0..MESSAGES).collect::<Vec<_>>());
            assert!(metadata && damage == Damage::default() && end == End::Whole);
        }
        let bytes = file(None);
        let mut outside = Records::new(&bytes[..]).unwrap().outside_chunks();
        let mut found = 0;
        while let Some(record) = outside.record().unwrap() {
            assert!(!matches!(record, Record::Message { .. }));
            found += u32::from(matches!(record, Record::Metadata(_)));
        }
        assert_eq!(found, 1);
    }

    proptest! {
        #[test]
        fn a_flipped_bit_costs_one_chunk(part in 0.0..1.0f64, bit in 0..8u32, lz4: bool) {
            let whole = file(Some(if lz4 { Compression::Lz4 } else { Compression::Zstd }));
            let index = whole.len() - 28;
            let end = u64::from_le_bytes(whole[index..index + 8].try_into().unwrap()) as usize;
            // From behind the magic to the record that ends the data.
            let at = 8 + (part * (end - 8 - 13) as f64) as usize;
            let mut bytes = whole.clone();
            bytes[at] ^= 1 << bit;
            let (messages, _, damage, end) = read(&bytes);
            prop_assert!(damage.words().is_some() || end == End::CutShort, "byte {at} unsaid");
            prop_assert!(messages.len() as u32 >= MESSAGES - IN_CHUNK, "byte {at}: {messages:?}");
            prop_assert!(messages.is_sorted());
        }

        #[test]
        fn a_zero_tail_or_a_cut_costs_what_it_covers(part in 0.1..1.0f64, zeros: bool) {
            let mut bytes = file(Some(Compression::Zstd));
            let at = (part * bytes.len() as f64) as usize;
            let uncut = read(&bytes[..at]).0;
            if zeros {
                bytes[at..].fill(0);
                prop_assert_eq!(&read(&bytes).0, &uncut);
            }
            let known: Vec<u32> = (0..uncut.len() as u32).collect();
            prop_assert_eq!(uncut, known);
        }
    }
}
