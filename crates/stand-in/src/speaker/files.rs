//! MAVLink's file protocol, by which there is nothing to be had.

/// Codes of MAVLink's file protocol: to end a session or all of them, yes, no, and why not.
const END_SESSION: u8 = 1;
const END_ALL_SESSIONS: u8 = 2;
const ACK: u8 = 128;
const NAK: u8 = 129;
const FILE_NOT_FOUND: u8 = 10;

/// The answer to a request of the file protocol: there are no files, so that ending a session is all
/// that succeeds. None to what is itself an answer.
pub(super) fn answer(request: &[u8; 251]) -> Option<[u8; 251]> {
    let mut answer = [0; 251];
    let sequence = u16::from_le_bytes([request[0], request[1]]).wrapping_add(1);
    answer[..2].copy_from_slice(&sequence.to_le_bytes());
    answer[2] = request[2];
    let opcode = request[3];
    answer[5] = opcode;
    match opcode {
        ACK | NAK => return None,
        0 | END_SESSION | END_ALL_SESSIONS => answer[3] = ACK,
        _ => {
            answer[3] = NAK;
            // One byte of data: why.
            answer[4] = 1;
            answer[12] = FILE_NOT_FOUND;
        }
    }
    Some(answer)
}
