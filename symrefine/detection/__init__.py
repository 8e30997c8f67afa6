"""The paper on one page: points -> moments -> proposals -> fits -> one table of misses -> the group."""
