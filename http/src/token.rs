//! Random numbers that others cannot guess: the access token of servers that other machines can reach, and addresses.

use crate::error::ServeError;
use std::fmt;
use std::net::Ipv4Addr;
use subtle::ConstantTimeEq;

/// Number of random bytes of a token: 128 bits cannot be guessed.
const TOKEN_BYTES: usize = 16;

/// A random secret that grants access to a server.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(..)")
    }
}

impl Token {
    /// Creates a random token.
    ///
    /// # Errors
    /// The operating system provides no random numbers.
    pub fn random() -> Result<Self, ServeError> {
        Ok(Self(random_hex()?))
    }

    /// Returns the token as used in the URL.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// True if `given` equals the token. The comparison takes constant time, so its duration reveals nothing about the
    /// token.
    pub fn matches(&self, given: &str) -> bool {
        // The length is not secret.
        self.0.as_bytes().ct_eq(given.as_bytes()).into()
    }
}

/// A random address of 127.0.0.0/8. Pages in a browser cannot find a server by trying all 16 million addresses, each with
/// all ports.
///
/// # Errors
/// The operating system provides no random numbers.
pub fn random_loopback() -> Result<Ipv4Addr, ServeError> {
    let [a, b, c, ..] = random_bytes()?;
    // Neither 127.0.x.y, where other servers listen, nor addresses of networks and broadcasts.
    Ok(Ipv4Addr::new(127, 1 + a % 254, b, 1 + c % 254))
}

/// Returns 32 random hexadecimal digits.
///
/// # Errors
/// The operating system provides no random numbers.
pub fn random_hex() -> Result<String, ServeError> {
    Ok(random_bytes()?.iter().map(|byte| format!("{byte:02x}")).collect())
}

fn random_bytes() -> Result<[u8; TOKEN_BYTES], ServeError> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes).map_err(|error| ServeError::System(format!("no random numbers: {error}")))?;
    Ok(bytes)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;

    #[test]
    fn loopback_addresses() {
        let [first, second] = [(); 2].map(|()| random_loopback().unwrap());
        assert!(first.is_loopback() && second.is_loopback() && first.octets()[1] != 0, "{first} {second}");
        // Two equal addresses by chance: once in 16 million runs.
        assert_ne!(first, second);
    }

    /// A token equals only itself, and is not printed by `Debug`.
    #[test]
    fn equality() {
        let [token, second] = [(); 2].map(|()| Token::random().unwrap());
        let text = token.as_str();
        assert_eq!(text.len(), 2 * TOKEN_BYTES);
        assert!(token.matches(text) && token != second && !format!("{token:?}").contains(text));
        let changed = (0..text.len()).map(|k| {
            let digit = if &text[k..=k] == "0" { "1" } else { "0" };
            format!("{}{digit}{}", &text[..k], &text[k + 1..])
        });
        for other in changed.chain([String::new(), text[1..].into(), format!("{text}0")]) {
            assert!(!token.matches(&other), "{other}");
        }
    }
}
