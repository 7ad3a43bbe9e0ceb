//! Random numbers for keys and questions.

use crate::NetError;

/// Random bytes from the system, fit for keys.
///
/// # Errors
/// [`NetError::Random`].
pub fn random<const N: usize>() -> Result<[u8; N], NetError> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).map_err(|e| NetError::Random(e.to_string()))?;
    Ok(bytes)
}
