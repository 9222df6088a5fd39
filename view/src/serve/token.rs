//! The secret of a view that other machines can reach.

use super::error::ServeError;
use std::fmt;
use std::hint::black_box;

/// Bytes of a token: too many to be guessed.
const BYTES: usize = 16;

/// A random secret: who knows it may look and act.
#[derive(Clone, PartialEq, Eq)]
pub(super) struct Token(String);

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(..)")
    }
}

impl Token {
    /// A new one.
    pub(super) fn random() -> Result<Self, ServeError> {
        Ok(Self(random_hex()?))
    }

    /// As it stands in the address of the page.
    pub(super) fn as_str(&self) -> &str {
        &self.0
    }

    /// Whether `given` is this one; the time that takes tells nothing of how much of it is right.
    pub(super) fn is(&self, given: &str) -> bool {
        let (own, given) = (self.0.as_bytes(), given.as_bytes());
        // Its length is no secret.
        own.len() == given.len()
            && black_box(own.iter().zip(given).fold(0, |apart, (a, b)| black_box(apart | (a ^ b)))) == 0
    }
}

/// 32 random hexadecimal digits.
pub(super) fn random_hex() -> Result<String, ServeError> {
    let mut bytes = [0; BYTES];
    getrandom::fill(&mut bytes).map_err(|error| ServeError::System(format!("no random numbers: {error}")))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_itself_only() {
        let token = Token::random().expect("random numbers");
        assert_eq!(token.as_str().len(), 2 * BYTES);
        assert!(token.is(token.as_str()));
        for k in 0..token.as_str().len() {
            let mut other = token.as_str().to_string().into_bytes();
            other[k] = if other[k] == b'0' { b'1' } else { b'0' };
            assert!(!token.is(&String::from_utf8(other).expect("ASCII")), "digit {k}");
        }
        assert!(!token.is("") && !token.is(&token.as_str()[1..]) && !token.is(&format!("{}0", token.as_str())));
    }

    #[test]
    fn two_tokens_differ_and_are_not_printed() {
        let [a, b] = [(); 2].map(|()| Token::random().expect("random numbers"));
        assert_ne!(a, b);
        assert!(!format!("{a:?}").contains(a.as_str()));
    }
}
