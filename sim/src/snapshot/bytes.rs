//! Little-endian encoding of numbers and texts; the reader never trusts a length.

/// Writer of encoded values.
#[derive(Debug, Default)]
pub(super) struct ByteWriter(pub(super) Vec<u8>);

impl ByteWriter {
    pub(super) fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    pub(super) fn u64(&mut self, value: u64) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    pub(super) fn text(&mut self, text: &str) {
        self.u64(text.len() as u64);
        self.0.extend_from_slice(text.as_bytes());
    }

    pub(super) fn numbers(&mut self, values: &[f64]) {
        self.u64(values.len() as u64);
        values.iter().for_each(|value| self.0.extend_from_slice(&value.to_le_bytes()));
    }

    pub(super) fn flags(&mut self, values: &[bool]) {
        self.u64(values.len() as u64);
        self.0.extend(values.iter().map(|&flag| u8::from(flag)));
    }
}

/// Reader of the remaining bytes.
#[derive(Debug)]
pub(super) struct ByteReader<'b>(pub(super) &'b [u8]);

/// The content ends early, or is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Malformed(pub(super) &'static str);

const SHORT: Malformed = Malformed("a list is longer than the file");

impl<'b> ByteReader<'b> {
    fn take(&mut self, count: usize) -> Result<&'b [u8], Malformed> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(SHORT)?;
        self.0 = rest;
        Ok(taken)
    }

    fn array<const K: usize>(&mut self) -> Result<[u8; K], Malformed> {
        let (taken, rest) = self.0.split_first_chunk::<K>().ok_or(SHORT)?;
        self.0 = rest;
        Ok(*taken)
    }

    pub(super) fn u8(&mut self) -> Result<u8, Malformed> {
        self.array::<1>().map(|[byte]| byte)
    }

    pub(super) fn u32(&mut self) -> Result<u32, Malformed> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, Malformed> {
        self.array().map(u64::from_le_bytes)
    }

    /// Reads a count of elements that take at least `bytes` each.
    pub(super) fn count(&mut self, bytes: usize) -> Result<usize, Malformed> {
        let count = usize::try_from(self.u64()?).map_err(|_| SHORT)?;
        if count.checked_mul(bytes).is_some_and(|all| all <= self.0.len()) { Ok(count) } else { Err(SHORT) }
    }

    pub(super) fn text(&mut self) -> Result<String, Malformed> {
        let count = self.count(1)?;
        String::from_utf8(self.take(count)?.to_vec()).map_err(|_| Malformed("a string is not UTF-8"))
    }

    pub(super) fn numbers(&mut self) -> Result<Vec<f64>, Malformed> {
        let count = self.count(8)?;
        Ok(self.take(8 * count)?.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
    }

    pub(super) fn flags(&mut self) -> Result<Vec<bool>, Malformed> {
        let count = self.count(1)?;
        let flag = |byte: &u8| match byte {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(Malformed("a flag is neither 0 nor 1")),
        };
        self.take(count)?.iter().map(flag).collect()
    }
}
