//! The seal that everything said on the bus of a mission carries beside its envelope: it shows that whoever said it
//! holds the mission's key, and that it was not said before.
//!
//! A seal is an HMAC-SHA256 (RFC 2104) over the key expression, the bytes said, the run, and a number that grows.
//! It is no part of envelope, digest or recording. It does not hide anything: who is let onto the bus can listen.

pub use crate::error::SealFault;

use crate::digest::hex;
use crate::error::ProtocolError;
use hmac::{Hmac, KeyInit as _, Mac as _};
use sha2::Sha256;
use std::collections::BTreeMap;

/// Length of a mission's key, bytes: that of the hash, as RFC 2104 recommends.
const KEY_BYTES: usize = 32;
/// Length of a seal, bytes: run, stream and number of 8 each, then the code.
pub const SEAL_BYTES: usize = 3 * NUMBER_BYTES + CODE_BYTES;
const NUMBER_BYTES: usize = 8;
const CODE_BYTES: usize = 32;
/// What codes of messages begin with, so that none is taken for one of something else.
const MESSAGE: &[u8] = b"plumage message\0";
/// What codes of answers begin with.
const ANSWER: &[u8] = b"plumage answer\0";

/// The key of a mission: who holds it may say what moves a vehicle.
#[derive(Clone, PartialEq, Eq)]
pub struct MissionKey([u8; KEY_BYTES]);

impl std::fmt::Debug for MissionKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("MissionKey(not shown)")
    }
}

impl MissionKey {
    /// The key of these bytes, which have to be random.
    pub fn new(bytes: [u8; KEY_BYTES]) -> Self {
        Self(bytes)
    }

    /// Reads 64 hexadecimal digits, white space around them aside.
    ///
    /// # Errors
    /// [`ProtocolError::BadKey`].
    pub fn parse(text: &str) -> Result<Self, ProtocolError> {
        let digits: Option<Vec<u32>> = text.trim().chars().map(|c| c.to_digit(16)).collect();
        let bytes: Vec<u8> = digits
            .unwrap_or_default()
            .chunks(2)
            .map(|pair| pair.iter().fold(0, |byte, digit| byte * 16 + *digit as u8))
            .collect();
        match bytes.try_into() {
            Ok(bytes) if text.trim().len() == 2 * KEY_BYTES => Ok(Self(bytes)),
            _ => Err(ProtocolError::BadKey),
        }
    }

    /// The key as [`MissionKey::parse`] reads it.
    pub fn to_hex(&self) -> String {
        hex(&self.0)
    }

    fn begun(&self, what: &[u8]) -> Option<Hmac<Sha256>> {
        // HMAC takes keys of any length.
        let mut code = Hmac::<Sha256>::new_from_slice(&self.0).ok()?;
        code.update(what);
        Some(code)
    }

    /// The code of an answer to whoever asked with `question`, a random number: it cannot be an old one.
    pub fn answer_code(&self, question: &[u8], answer: &[u8]) -> Vec<u8> {
        self.answer_begun(question, answer)
            .map(|code| code.finalize().into_bytes().to_vec())
            .unwrap_or_default()
    }

    /// Whether `code` is that of `answer` to `question`.
    pub fn is_answer(&self, question: &[u8], answer: &[u8], code: &[u8]) -> bool {
        self.answer_begun(question, answer)
            .is_some_and(|own| own.verify_slice(code).is_ok())
    }

    fn answer_begun(&self, question: &[u8], answer: &[u8]) -> Option<Hmac<Sha256>> {
        let mut code = self.begun(ANSWER)?;
        code.update(&(question.len() as u64).to_be_bytes());
        code.update(question);
        code.update(answer);
        Some(code)
    }

    fn message_begun(&self, key: &str, bytes: &[u8], numbers: &[u8]) -> Option<Hmac<Sha256>> {
        let mut code = self.begun(MESSAGE)?;
        code.update(numbers);
        code.update(&(key.len() as u64).to_be_bytes());
        code.update(key.as_bytes());
        code.update(bytes);
        Some(code)
    }
}

/// Seals what one process says.
#[derive(Debug)]
pub struct Sealer {
    key: MissionKey,
    /// Random: that of this process among all that speak.
    stream: u64,
    number: u64,
}

impl Sealer {
    /// The sealer of a process whose random number is `stream`.
    pub fn new(key: MissionKey, stream: u64) -> Self {
        Self {
            key,
            stream,
            number: 0,
        }
    }

    /// The number of this process, and how often it has spoken.
    pub fn so_far(&self) -> (u64, u64) {
        (self.stream, self.number)
    }

    /// The seal of `bytes` said now on the key expression `key` in the run `run`.
    pub fn seal(&mut self, run: u64, key: &str, bytes: &[u8]) -> Vec<u8> {
        self.number += 1;
        let mut seal = Vec::with_capacity(SEAL_BYTES);
        for number in [run, self.stream, self.number] {
            seal.extend_from_slice(&number.to_be_bytes());
        }
        let code = self.key.message_begun(key, bytes, &seal);
        seal.extend(
            code.map(|code| code.finalize().into_bytes())
                .unwrap_or_default(),
        );
        seal
    }
}

/// Looks at the seals of what one process hears.
#[derive(Debug)]
pub struct SealCheck {
    key: MissionKey,
    /// The run that is heard; any where it is not known.
    run: Option<u64>,
    /// Last number heard, by stream and key expression: an order is kept on each of these alone.
    heard: BTreeMap<u64, BTreeMap<String, u64>>,
    /// What streams had said when this process joined.
    before: BTreeMap<u64, u64>,
}

impl SealCheck {
    /// A check that has heard nothing.
    pub fn new(key: MissionKey) -> Self {
        Self {
            key,
            run: None,
            heard: BTreeMap::new(),
            before: BTreeMap::new(),
        }
    }

    /// From now on only what is said in `run` counts.
    pub fn only_run(&mut self, run: u64) {
        self.run = Some(run);
    }

    /// What `stream` said up to `number` does not count.
    pub fn only_after(&mut self, stream: u64, number: u64) {
        self.before.insert(stream, number);
    }

    /// Takes `bytes`, said on the key expression `key`, by their `seal`.
    ///
    /// # Errors
    /// Why they are not taken.
    pub fn take(&mut self, key: &str, bytes: &[u8], seal: Option<&[u8]>) -> Result<(), SealFault> {
        let seal = seal.ok_or(SealFault::Missing)?;
        let (numbers, code) = seal
            .split_at_checked(3 * NUMBER_BYTES)
            .ok_or(SealFault::Wrong)?;
        let own = self.key.message_begun(key, bytes, numbers);
        let own = own.ok_or(SealFault::Wrong)?;
        own.verify_slice(code).map_err(|_| SealFault::Wrong)?;
        let [run, stream, number] = [0, 1, 2].map(|k| {
            let bytes = numbers[k * NUMBER_BYTES..].first_chunk();
            bytes.map_or(0, |bytes| u64::from_be_bytes(*bytes))
        });
        if self.run.is_some_and(|own| own != run) {
            return Err(SealFault::OtherRun);
        }
        let heard = self.heard.entry(stream).or_default();
        let last = match heard.get_mut(key) {
            Some(last) => last,
            None => heard.entry(key.to_owned()).or_default(),
        };
        let before = self.before.get(&stream).copied().unwrap_or_default();
        if number <= before.max(*last) {
            return Err(SealFault::Replayed);
        }
        *last = number;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(byte: u8) -> MissionKey {
        MissionKey::new([byte; KEY_BYTES])
    }

    /// By Python's `hmac`: `hmac.new(bytes([7]) * 32, b"plumage message\0" + struct.pack(">QQQ", 1, 2, 1) +
    /// struct.pack(">Q", 3) + b"key" + b"said", "sha256").hexdigest()`.
    #[test]
    fn a_seal_is_what_another_implementation_makes() {
        let seal = Sealer::new(key(7), 2).seal(1, "key", b"said");
        assert_eq!(
            hex(&seal[24..]),
            "da869052189ace4e6efdc1b34d6e59346b34c5c6f5186246c0dbba3ffbd172b6"
        );
        assert_eq!(seal.len(), SEAL_BYTES);
    }

    #[test]
    fn what_was_sealed_is_taken_once_and_nothing_else_is() {
        let mut sealer = Sealer::new(key(1), 5);
        let (first, second) = (sealer.seal(9, "a", b"x"), sealer.seal(9, "a", b"x"));
        let mut check = SealCheck::new(key(1));
        check.only_run(9);
        assert_eq!(check.take("a", b"x", None), Err(SealFault::Missing));
        assert_eq!(check.take("b", b"x", Some(&first)), Err(SealFault::Wrong));
        assert_eq!(check.take("a", b"y", Some(&first)), Err(SealFault::Wrong));
        assert_eq!(check.take("a", b"x", Some(b"short")), Err(SealFault::Wrong));
        assert_eq!(
            check.take("a", b"x", Some(&first[..55])),
            Err(SealFault::Wrong)
        );
        let foreign = Sealer::new(key(2), 5).seal(9, "a", b"x");
        assert_eq!(check.take("a", b"x", Some(&foreign)), Err(SealFault::Wrong));
        let earlier = Sealer::new(key(1), 5).seal(8, "a", b"x");
        assert_eq!(
            check.take("a", b"x", Some(&earlier)),
            Err(SealFault::OtherRun)
        );
        assert_eq!(check.take("a", b"x", Some(&first)), Ok(()));
        assert_eq!(
            check.take("a", b"x", Some(&first)),
            Err(SealFault::Replayed)
        );
        assert_eq!(check.take("a", b"x", Some(&second)), Ok(()));
        assert_eq!(
            check.take("a", b"x", Some(&first)),
            Err(SealFault::Replayed)
        );
        // Another key expression has an order of its own, and so has another process.
        let other = sealer.seal(9, "b", b"x");
        assert_eq!(check.take("b", b"x", Some(&other)), Ok(()));
        let another = Sealer::new(key(1), 6).seal(9, "a", b"x");
        assert_eq!(check.take("a", b"x", Some(&another)), Ok(()));
    }

    #[test]
    fn who_joins_late_does_not_take_what_was_said_before() {
        let mut sealer = Sealer::new(key(1), 5);
        let before = sealer.seal(9, "a", b"x");
        let mut check = SealCheck::new(key(1));
        let (stream, number) = sealer.so_far();
        check.only_after(stream, number);
        assert_eq!(
            check.take("a", b"x", Some(&before)),
            Err(SealFault::Replayed)
        );
        let after = sealer.seal(9, "a", b"x");
        assert_eq!(check.take("a", b"x", Some(&after)), Ok(()));
    }

    #[test]
    fn an_answer_holds_for_its_question_alone() {
        let code = key(3).answer_code(b"question", b"answer");
        assert!(key(3).is_answer(b"question", b"answer", &code));
        assert!(!key(3).is_answer(b"another", b"answer", &code));
        assert!(!key(3).is_answer(b"questio", b"nanswer", &code));
        assert!(!key(4).is_answer(b"question", b"answer", &code));
    }

    #[test]
    fn a_key_reads_back_and_nothing_else_is_one() {
        let digits = key(0xa7).to_hex();
        assert_eq!(MissionKey::parse(&format!(" {digits}\n")), Ok(key(0xa7)));
        for wrong in [
            "",
            "a7",
            &digits[1..],
            &format!("{digits}0"),
            &digits.replace('7', "g"),
        ] {
            assert_eq!(
                MissionKey::parse(wrong),
                Err(ProtocolError::BadKey),
                "{wrong}"
            );
        }
        assert!(!format!("{:?}", key(0xa7)).contains("a7"));
    }
}
