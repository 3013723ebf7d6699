"""The conformance kit: does a controller keep the contract?"""
