//! Encoding of messages: the Common Data Representation of the OMG (formal/02-06-51, chapter 15), little-endian, as ROS
//! 2 uses it.

/// Header of every message: little-endian, no options.
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// Writer of a message. Every number is aligned to a multiple of its size, counted from the end of the header.
#[derive(Debug, Default)]
pub(crate) struct CdrWriter(Vec<u8>);

impl CdrWriter {
    /// Begins a message, reusing the memory of the previous one.
    pub(crate) fn begin(&mut self) {
        self.0.clear();
        self.0.extend_from_slice(&HEADER);
    }

    /// Bytes of the message.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.0
    }

    fn align(&mut self, size: usize) {
        let end = (self.0.len() - HEADER.len()).next_multiple_of(size) + HEADER.len();
        self.0.resize(end, 0);
    }

    pub(crate) fn u8(&mut self, number: u8) {
        self.0.push(number);
    }

    pub(crate) fn u32(&mut self, number: u32) {
        self.align(4);
        self.0.extend_from_slice(&number.to_le_bytes());
    }

    pub(crate) fn i32(&mut self, number: i32) {
        self.align(4);
        self.0.extend_from_slice(&number.to_le_bytes());
    }

    pub(crate) fn f64(&mut self, number: f64) {
        self.align(8);
        self.0.extend_from_slice(&number.to_le_bytes());
    }

    /// Writes an array of fixed length: numbers without a length.
    pub(crate) fn f64s(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|number| self.f64(*number));
    }

    /// Writes a length.
    pub(crate) fn length(&mut self, count: usize) {
        // No message of a recording exceeds 4 GiB: images and states are far below.
        self.u32(u32::try_from(count).unwrap_or(u32::MAX));
    }

    /// Writes a string, with its terminating zero.
    pub(crate) fn string(&mut self, text: &str) {
        self.length(text.len() + 1);
        self.0.extend_from_slice(text.as_bytes());
        self.0.push(0);
    }

    /// Writes a sequence of numbers.
    pub(crate) fn f64_sequence(&mut self, numbers: &[f64]) {
        self.length(numbers.len());
        self.f64s(numbers);
    }

    /// Writes a sequence of bytes.
    pub(crate) fn octet_sequence(&mut self, bytes: &[u8]) {
        self.length(bytes.len());
        self.0.extend_from_slice(bytes);
    }

    /// Writes a sequence of `count` bytes, which `put` appends.
    pub(crate) fn octet_sequence_with(&mut self, count: usize, put: impl FnOnce(&mut Vec<u8>)) {
        self.length(count);
        put(&mut self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alignment() {
        let mut cdr = CdrWriter::default();
        cdr.begin();
        cdr.u8(7);
        cdr.u32(1);
        cdr.f64(0.0);
        cdr.string("a");
        cdr.f64_sequence(&[]);
        let expected = [&[0, 1, 0, 0, 7, 0, 0, 0, 1, 0, 0, 0][..], &[0; 8], &[2, 0, 0, 0, b'a', 0, 0, 0, 0, 0, 0, 0]];
        assert_eq!(cdr.bytes(), expected.concat());
    }
}
